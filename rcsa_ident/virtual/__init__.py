"""The virtual machine: a finite-element spindle that mills, and the sensors that watch it. An honest source of recordings."""
