"""Sweeps over designs: where does a robot stop getting up?"""
