"""How sure a score is: people, sequences and trainings are resampled, and intervals follow."""
