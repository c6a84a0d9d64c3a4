"""Which effects the model needs: candidates, stepwise selection, variants of laws, validation."""
