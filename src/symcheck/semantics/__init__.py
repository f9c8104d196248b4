"""From a text's tree to a bound model: names, types, constants, composition."""
