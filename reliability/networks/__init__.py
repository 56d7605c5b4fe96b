"""Neural networks for the classifier: modules, training and inference. Only here is torch used."""
