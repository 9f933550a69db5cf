"""A subject's own hand: lengths, palm and joint axes from sequences, and what is attainable."""
