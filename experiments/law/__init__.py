"""The law: each method's cost, predicted by `experiments.law.model` and measured, scene by scene."""
