"""What each part of a recogniser's training is worth, on people whom it has not met."""
