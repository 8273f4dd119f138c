"""The belief against the recogniser's own words, in clips and in streams."""
