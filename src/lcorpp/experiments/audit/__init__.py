"""The audit of what is stated: knowledge, rates of classifiers, observation model."""
