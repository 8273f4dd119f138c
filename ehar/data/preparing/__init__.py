"""What original motion needs before it is data: units and axes, gaps filled, joints known by their names and mapped."""
