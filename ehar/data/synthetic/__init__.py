"""Two built-in motion sets, `duo` and `solo`: actors who differ perform figures that overlap."""
