"""Cutting forces from the flange's vibration: a Kalman filter on the identified cross FRF."""
