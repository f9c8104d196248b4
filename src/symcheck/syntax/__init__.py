"""The languages of models and properties: trees, parser, printer."""
