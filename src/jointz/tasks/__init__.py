"""Engines that run tasks in parallel, and the store of finished tasks."""
