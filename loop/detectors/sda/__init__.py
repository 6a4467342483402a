"""Stacked denoising autoencoder."""
