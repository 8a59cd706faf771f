"""How a tooth cuts: cutter, conditions, coefficients, forces, directional coefficients."""
