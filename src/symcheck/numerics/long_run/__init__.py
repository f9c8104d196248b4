"""Long-run averages: stationary distributions of chains and mean payoffs of MDPs."""
