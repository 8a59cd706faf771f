"""Live forces: a process of its own holds the observers, frames come and go over WebSockets."""
