namespace sofa { namespace core {
struct ObjectRegistrationData {
    explicit ObjectRegistrationData(const std::string &) {}
    template <class T> ObjectRegistrationData &add(bool = false) { T made; made.init(); return *this; }
};
struct ObjectFactory { bool registerObjects(ObjectRegistrationData &) { return true; } };
} }
