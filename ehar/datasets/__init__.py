"""Where motion comes from: ExPI, AIST++ and BVH files, and two synthetic sets."""
