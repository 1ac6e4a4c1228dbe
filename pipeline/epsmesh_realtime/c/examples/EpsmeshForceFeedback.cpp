/* SOFA: a force feedback that a haptic driver (Geomagic, Haption) calls in its own thread.
 *
 * In the scene, beside the driver:
 *
 *     <EpsmeshForceFeedback name="tissue" model="pad.epsm" radius="5e-3" most="3" />
 *     <GeomagicDriver forceFeedBack="@tissue" scale="0.001" ... />
 *
 * The driver's positions come in the scene's unit, here metres. The scene's own deformable body must not push the tool
 * too: this is its force.
 *
 * A plug-in for SOFA 24.12 or later: a CMake project that finds Sofa.Component.Haptics, this file and epsmesh.c (as C)
 * in one shared library, and <RequiredPlugin name="EpsmeshForceFeedback"/> in the scene.
 */
#include <sofa/component/haptics/ForceFeedback.h>
#include <sofa/core/ObjectFactory.h>
#include <sofa/defaulttype/SolidTypes.h>

#include "hand.h"

namespace epsmesh {

class EpsmeshForceFeedback : public sofa::component::haptics::ForceFeedback {
public:
    SOFA_CLASS(EpsmeshForceFeedback, sofa::component::haptics::ForceFeedback);
    using Solid = sofa::defaulttype::SolidTypes<SReal>;

    sofa::core::objectmodel::Data<std::string> d_model;
    sofa::core::objectmodel::Data<double> d_radius, d_most;

    EpsmeshForceFeedback()
        : d_model(initData(&d_model, std::string(), "model", "file that epsmesh export made")),
          d_radius(initData(&d_radius, 5e-3, "radius", "radius of the ball (m)")),
          d_most(initData(&d_most, 3.0, "most", "largest force that the device is asked for (N)")) {}

    void init() override {
        ForceFeedback::init();
        const char *problem = hand_load(&m_hand, d_model.getValue().c_str(), d_radius.getValue(), d_most.getValue());
        m_isReady = problem == nullptr;
        if (problem) msg_error() << d_model.getValue() << ": " << problem;
    }

    void computeForce(SReal x, SReal y, SReal z, SReal, SReal, SReal, SReal, SReal &fx, SReal &fy, SReal &fz) override {
        const double tip[3] = {x, y, z};
        double force[3] = {0, 0, 0};
        if (m_isReady) hand_feel(&m_hand, tip, force);
        fx = SReal(force[0]), fy = SReal(force[1]), fz = SReal(force[2]);
    }

    /* Drivers of six degrees of freedom ask for a wrench in the tool's frame; here it has no moment. */
    void computeWrench(const Solid::Transform &tool, const Solid::SpatialVector &, Solid::SpatialVector &wrench) override {
        const auto at = tool.getOrigin();
        SReal fx, fy, fz;
        computeForce(at[0], at[1], at[2], 0, 0, 0, 1, fx, fy, fz);
        wrench.setForce(tool.getOrientation().inverseRotate(Solid::Vec3(fx, fy, fz)));
        wrench.setTorque(Solid::Vec3(0, 0, 0));
    }

private:
    hand m_hand;
    bool m_isReady = false;
};

} // namespace epsmesh

/* What SOFA asks a plug-in for when it is loaded. */
extern "C" {
SOFA_EXPORT_DYNAMIC_LIBRARY void initExternalModule() {}

SOFA_EXPORT_DYNAMIC_LIBRARY const char *getModuleName() { return "EpsmeshForceFeedback"; }

SOFA_EXPORT_DYNAMIC_LIBRARY void registerObjects(sofa::core::ObjectFactory *factory) {
    factory->registerObjects(
        sofa::core::ObjectRegistrationData("Force and error bar of epsmesh's real-time model")
            .add<epsmesh::EpsmeshForceFeedback>());
}
}
