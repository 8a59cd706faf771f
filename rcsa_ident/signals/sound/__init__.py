"""What one recording says of itself: speed, lines, foreign tones, decays."""
