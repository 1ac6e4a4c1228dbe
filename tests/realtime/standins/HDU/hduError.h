int hduIsSchedulerError(const HDErrorInfo *);
