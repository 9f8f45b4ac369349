"""Register maps: what stands where in a device, which reads it takes, and what the bytes mean."""
