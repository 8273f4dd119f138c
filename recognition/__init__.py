"""What is being seen: CTR-GCN as published, its streaming form, training and calibration."""
