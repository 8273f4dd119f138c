"""What views can win: a map of fixed cameras around people, for all classes and for each."""
