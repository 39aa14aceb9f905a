"""Shapes of this and of other packages: conversion, affine maps, area elements and inspection."""
