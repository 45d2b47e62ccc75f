"""The law: each method's cost, predicted by `atra.model` and measured, scene by scene."""
