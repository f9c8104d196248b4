"""Values of partially observed models: bounds from both sides, by exploration of beliefs."""
