"""What the networks compute most, compiled for the processor at hand."""
