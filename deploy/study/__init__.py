"""Sessions of a study: protocol, marks, pseudonyms, and the seal over their files."""
