"""The laboratory: two da Vinci arms and a soft body in PyBullet."""
