"""Path formulas that need graph analysis of a product: LTL, CTL*, fairness."""
