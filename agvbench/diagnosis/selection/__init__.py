"""Selection of the effects that the model needs: candidates, stepwise selection, variants, validation."""
