"""The experiments of `dnet evaluate paper`: what runs, where it lies, and what it was made with."""
