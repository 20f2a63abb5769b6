"""Readers and writers of recordings and studies."""
