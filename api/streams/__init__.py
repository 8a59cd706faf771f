"""Live forces: sessions of WebSocket clients, and the process that runs their observers."""
