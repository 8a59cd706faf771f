"""python -m rcsa_ident.cli."""

from rcsa_ident.cli import main

if __name__ == "__main__":
    main()
