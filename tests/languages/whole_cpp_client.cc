// Linked with all of the C++ library; that it links is the test.

int main() { return 0; }
