"""What a measurement needs: interleaved rounds, memory of this process, the machine's description."""
