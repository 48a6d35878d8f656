"""Files that are written whole, by one writer, of bounded size, under plain names."""
