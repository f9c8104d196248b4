"""Commands and events as transition relations."""
