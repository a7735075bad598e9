"""Observers: they see frames and contacts, and no answer depends on them."""
