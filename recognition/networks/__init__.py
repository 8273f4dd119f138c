"""Networks: CTR-GCN as published, and its causal form."""
