"""The protocol that CTR-GCN was published with on Northwestern-UCLA: 3D joints, whole sequences, fixed epochs."""
