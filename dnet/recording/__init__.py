"""Recording a whole dataset: what is asked for, pair by pair, on several processes or machines."""
