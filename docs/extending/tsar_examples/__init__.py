"""An example of each thing that a package can add to tsar; ``python -m tsar_examples`` uses them all."""
