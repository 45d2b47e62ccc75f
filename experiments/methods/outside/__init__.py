"""Methods from outside of this repository: classes in files and packages, and external programs."""
