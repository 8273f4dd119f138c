"""Training of a recogniser: clips, cameras, the training loop and its checkpoints."""
