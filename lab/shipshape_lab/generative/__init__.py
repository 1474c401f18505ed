"""The paper's future work: a generative restorer, as an optional bundle beside the deterministic one."""
