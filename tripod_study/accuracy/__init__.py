"""`--accuracy`: from an accuracy asked for to settings of a scene, by the stored study of that scene."""
