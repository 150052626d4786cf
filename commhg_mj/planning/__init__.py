"""Radio planning in one world: a link in section, coverage, pairs of radios, fitted decay lengths."""
