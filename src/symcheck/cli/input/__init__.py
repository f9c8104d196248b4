"""What a run reads: its model and its properties."""
