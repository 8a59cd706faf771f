"""What worker processes compute: the same workflows as the commands, with what does not change kept between queries."""
