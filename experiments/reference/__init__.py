"""The reference of programs, options and columns, made from the code when the documentation is built."""
