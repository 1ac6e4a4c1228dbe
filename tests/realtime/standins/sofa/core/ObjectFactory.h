namespace sofa { namespace core {
struct RegisterObject {
    RegisterObject(const char *) {}
    template <class T> RegisterObject &add() { T made; made.init(); return *this; }
    operator int() const { return 1; }
};
} }
