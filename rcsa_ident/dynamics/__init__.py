"""How things vibrate: coordinates, receptances, second-order structures, modes."""
