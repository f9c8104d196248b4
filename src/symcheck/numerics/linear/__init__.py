"""Linear equations x = A x + b: problems, preprocessing, direct and iterative solution."""
