"""The task as Gymnasium environments: one episode, or a batch in lockstep."""
