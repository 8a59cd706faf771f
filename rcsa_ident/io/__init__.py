"""Files in and out: millimetres, rev/min and GPa live here, SI everywhere inside."""
