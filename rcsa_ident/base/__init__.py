"""What every room stands on: errors, remarks, units, arrays, which values are usual, and a map over a cluster."""
