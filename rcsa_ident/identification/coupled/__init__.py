"""Both bending planes as one machine: modes with a direction, forces of both axes together, gyroscopic moments."""
