"""The reference, docs/reference.md: made from signatures, docstrings and options, never written by hand.

    python -m experiments.reference

writes the file anew. tests/documents/test_reference_page.py checks that the stored file is the one this program makes.
"""
