"""What P, S, R and quantile ask for: the way from a formula to the measures that answer it."""
