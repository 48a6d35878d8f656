"""Servo runs in the laboratory: what is asked for, how it is carried out, and what it leaves."""
